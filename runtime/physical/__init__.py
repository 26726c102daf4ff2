"""Bodies that exist: conditions of a physical robot, the values nearest to them."""
