"""Pictures with their truth: folders, videos, cameras, truth files, painted sequences."""
