"""The USD layer that a bake hands to a shot: redirected texture lookups, and redirected corner UVs as a primvar."""
