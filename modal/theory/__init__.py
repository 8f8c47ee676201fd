"""Provide theories to compare with: the FCC crystal, effective media, saturation."""
