"""The render: four passes over a scene, to see what a profile's error looks like."""
