"""Which numbers of a model's files a verdict tests.

A number is tested where a change of it by a thousandth of its size changes what the check compares
by more than a resolution of 1e-9: by motion (accelerations in a folder, ends of segments of a file
alone), by audit (a bound formula), or by frames (a declared pose). All numbers of the model file,
of the files that it includes, and of a folder's sidecar (settings, springs) are counted.

In a folder the engine is asked, since the equations do not know the file; of a file alone, and of a
folder that declares bodies, the equations that are made of the file. Numbers are moved in groups,
halved where something follows. A number that could not be moved is not tested, and says so.
"""
