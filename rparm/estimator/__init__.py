"""Estimators: extended Kalman filters that are made from a plant's file with equations."""
