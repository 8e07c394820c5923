"""Where a model's bodies are in the world: the system's frames, held against the engine's own.

Joint space can agree and the robot be another one: an axis flipped, a plane turned, a base moved.
"""
