"""What the pages of measured figures share: the machine, tables, pictures."""
