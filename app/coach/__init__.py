"""Session of shots for coaches: analysis in the background, comparison, report, video."""
