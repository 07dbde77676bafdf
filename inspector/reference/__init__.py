"""What is normal for a robot's scenarios: accepted runs, and how much louder another run is."""
