"""Whole shapes of single objects from crops about them: data, network, losses, measures."""
