"""An accuracy budget: what each imperfection of a scenario contributes to its error at the end."""
