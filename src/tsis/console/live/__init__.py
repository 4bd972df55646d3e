"""The live view: raw frames over a WebSocket of their own, the latest first."""
