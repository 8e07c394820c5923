"""What a verdict on a model covers: each number of its files is moved, and what follows looked at.

Accelerations and poses are asked for, not motions: a number that none of these depends on has no
say in any motion. Numbers are moved in groups, halved where something follows.
"""
