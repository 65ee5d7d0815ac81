"""Simulated cloth as artists' tools write it: Alembic, PC2, MDD and OBJ sequences, brought to the training layout."""
