"""From a good answer to an exact one: the structure that an answer shows, solved as a boundary
value problem of Pontryagin's conditions."""
