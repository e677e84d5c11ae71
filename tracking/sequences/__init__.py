"""Pictures from folders, videos, bags, streams and cameras, and the target's true place in them."""
