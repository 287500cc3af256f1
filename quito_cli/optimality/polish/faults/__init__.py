"""What was solved looked at: inequalities that do not hold, each with what it asks for."""
