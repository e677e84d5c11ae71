"""Writing files: whole or not at all, never through links; and the texts that go into them."""
