"""The two bytes behind the header of a DAT file: kind and size of its events."""

EVENT_BYTES = 8
EVENT_KINDS = (0x00, 0x0C)  # 2D events of version 1 and CD events of version 2
