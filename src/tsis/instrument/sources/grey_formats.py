"""Grey pixel formats of GenICam cameras, and the grey level at which each clips.

Packed kinds are left out: the unpacked one of as many bits holds the same light.
"""

FULL_SCALE = {"Mono8": 255.0, "Mono10": 1023.0, "Mono12": 4095.0, "Mono14": 16383.0, "Mono16": 65535.0}
