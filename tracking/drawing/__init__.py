"""Drawings of results: contact sheets, curves, annotated videos."""
