"""Files: atomic writes, bounded reading, values as JSON, cache, hash chains."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.files import archive as archive
    from tsis.files import atomic as atomic
    from tsis.files import cache as cache
    from tsis.files import canonical_json as canonical_json
    from tsis.files import frame_names as frame_names
    from tsis.files import hash_chain as hash_chain
    from tsis.files import images as images
    from tsis.files import json_values as json_values
    from tsis.files import reading as reading
    from tsis.files import result_folder as result_folder
    from tsis.files import result_schemas as result_schemas
    from tsis.files import tables as tables
else:  # modules load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(
        __name__,
        submodules=[
            "archive",
            "atomic",
            "cache",
            "canonical_json",
            "frame_names",
            "hash_chain",
            "images",
            "json_values",
            "reading",
            "result_folder",
            "result_schemas",
            "tables",
        ],
    )
