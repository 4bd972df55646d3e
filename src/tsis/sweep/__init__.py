"""Simulation sweeps: many presses as one data set that survives the loss of workers and interruptions."""

from tsis.sweep._dask_pool import AHEAD, DaskPool
from tsis.sweep._data_set import (
    MANIFEST_FILE,
    START,
    data_set_key,
    first_few,
    head,
    manifest_sha256,
    read_data_set,
    verify_data_set,
    write_manifest,
)
from tsis.sweep._plan import Plan, Range
from tsis.sweep._plan_file import EXAMPLE, load_plan, parse_plan_text, plan_document
from tsis.sweep._run import SweepSummary, run_sweep, seconds_per_press, worker_count
from tsis.sweep._samples import PressFunction, Rows, SweepBatch, press_all, sweep_batches
from tsis.sweep._shards import (
    DIGEST,
    Receipt,
    data_set_of,
    digest_position,
    encode_shard,
    receipt_of,
    rows_sha256,
    sha256,
    shard_name,
    sign_shard,
)
from tsis.sweep._work import Finished, SweepJob, finish_batch

__all__ = [
    "AHEAD",
    "DIGEST",
    "EXAMPLE",
    "MANIFEST_FILE",
    "START",
    "DaskPool",
    "Finished",
    "Plan",
    "PressFunction",
    "Range",
    "Receipt",
    "Rows",
    "SweepBatch",
    "SweepJob",
    "SweepSummary",
    "data_set_key",
    "data_set_of",
    "digest_position",
    "encode_shard",
    "finish_batch",
    "first_few",
    "head",
    "load_plan",
    "manifest_sha256",
    "parse_plan_text",
    "plan_document",
    "press_all",
    "read_data_set",
    "receipt_of",
    "rows_sha256",
    "run_sweep",
    "seconds_per_press",
    "sha256",
    "shard_name",
    "sign_shard",
    "sweep_batches",
    "verify_data_set",
    "worker_count",
    "write_manifest",
]
