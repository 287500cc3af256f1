"""Controls with kinks taken apart, and answers put together again."""
