"""What calls take and answer, as JSON describes it."""
