"""What a recording says, each number once: tracking, walking, standing, riding, falling."""
