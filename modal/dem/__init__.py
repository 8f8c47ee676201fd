"""Spheres in motion: contact forces with history, their contacts, the steps of their motion."""
