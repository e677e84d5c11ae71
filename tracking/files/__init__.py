"""Writing files: completely or not at all, and not through links; and the texts in them."""
