"""Models that stand for the paper's: closed formulas for geometry and poses."""
