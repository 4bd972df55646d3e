"""What the calls of libaravis 0.8 take and return; the interface of 0.8 no longer changes."""

from __future__ import annotations

import ctypes
from typing import Any

POINTER, TEXT = ctypes.c_void_p, ctypes.c_char_p
INT, UINT, U32, U64 = ctypes.c_int, ctypes.c_uint, ctypes.c_uint32, ctypes.c_uint64
SIZE, REAL = ctypes.c_size_t, ctypes.c_double

# By name without "arv_": what is returned, then what is taken.
PLAIN: dict[str, tuple[Any, ...]] = {
    "update_device_list": (None,),
    "get_n_devices": (UINT,),
    "get_device_id": (TEXT, UINT),
    "get_device_vendor": (TEXT, UINT),
    "get_device_model": (TEXT, UINT),
    "get_device_protocol": (TEXT, UINT),
    "get_device_address": (TEXT, UINT),
    "camera_get_device": (POINTER, POINTER),
    "camera_is_gv_device": (INT, POINTER),
    "gv_device_is_controller": (INT, POINTER),
    "device_get_feature": (POINTER, POINTER, TEXT),
    "gc_float_get_type": (SIZE,),
    "stream_push_buffer": (None, POINTER, POINTER),
    "stream_timeout_pop_buffer": (POINTER, POINTER, U64),
    "buffer_new_allocate": (POINTER, SIZE),
    "buffer_get_status": (INT, POINTER),
    "buffer_get_frame_id": (U64, POINTER),
    "buffer_get_timestamp": (U64, POINTER),
    "buffer_get_system_timestamp": (U64, POINTER),
    "buffer_get_data": (POINTER, POINTER, POINTER),
    "buffer_get_image_width": (INT, POINTER),
    "buffer_get_image_height": (INT, POINTER),
    "gv_fake_camera_new": (POINTER, TEXT, TEXT),
    "gv_fake_camera_is_running": (INT, POINTER),
    "gv_fake_camera_get_fake_camera": (POINTER, POINTER),
    "fake_camera_read_register": (INT, POINTER, U32, POINTER),
    "fake_camera_write_register": (INT, POINTER, U32, U32),
    "fake_camera_write_memory": (INT, POINTER, U32, U32, POINTER),
    "fake_camera_set_fill_pattern": (None, POINTER, POINTER, POINTER),
}

# The same for those that report errors: each takes the place for one after what is listed.
FALLIBLE: dict[str, tuple[Any, ...]] = {
    "camera_new": (POINTER, TEXT),
    "camera_get_sensor_size": (None, POINTER, POINTER, POINTER),
    "camera_get_region": (None, POINTER, POINTER, POINTER, POINTER, POINTER),
    "camera_set_region": (None, POINTER, INT, INT, INT, INT),
    "camera_dup_available_pixel_formats_as_strings": (POINTER, POINTER, POINTER),
    "camera_get_pixel_format_as_string": (TEXT, POINTER),
    "camera_set_pixel_format_from_string": (None, POINTER, TEXT),
    "camera_set_acquisition_mode": (None, POINTER, INT),
    "camera_get_payload": (UINT, POINTER),
    "camera_create_stream": (POINTER, POINTER, POINTER, POINTER),
    "camera_start_acquisition": (None, POINTER),
    "camera_stop_acquisition": (None, POINTER),
    "device_read_register": (None, POINTER, U64, POINTER),
    "gc_float_get_unit": (TEXT, POINTER),
} | {
    f"camera_{call.format(quantity)}": kinds
    for quantity in ("exposure_time", "gain", "black_level", "frame_rate")
    for call, kinds in {
        "is_{}_available": (INT, POINTER),
        "get_{}": (REAL, POINTER),
        "set_{}": (None, POINTER, REAL),
        "get_{}_bounds": (None, POINTER, POINTER, POINTER),
    }.items()
}
FALLIBLE |= {f"camera_is_{what}_auto_available": (INT, POINTER) for what in ("exposure", "gain", "black_level")}
FALLIBLE |= {f"camera_set_{what}_auto": (None, POINTER, INT) for what in ("exposure_time", "gain", "black_level")}

# Of the libraries below Aravis, by their full names.
BELOW: dict[str, tuple[Any, ...]] = {
    "g_object_unref": (None, POINTER),
    "g_free": (None, POINTER),
    "g_error_free": (None, POINTER),
    "g_value_init": (POINTER, POINTER, SIZE),
    "g_value_set_int": (None, POINTER, INT),
    "g_object_set_property": (None, POINTER, TEXT, POINTER),
    "g_type_check_instance_is_a": (INT, POINTER, SIZE),
}
