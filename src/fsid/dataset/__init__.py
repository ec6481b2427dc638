"""Samples, shards on disk, and training patches from them."""

from fsid.dataset.attempt import Sample, sample_key
from fsid.dataset.config import RENDERED, DatasetConfig, GenerateConfig, generate_config
from fsid.dataset.contact_sheet import contact_sheet, grid
from fsid.dataset.estimate import Estimate, estimate
from fsid.dataset.generate import Workforce, check_count, generate, pairs_there, pairs_to_make
from fsid.dataset.identity import begun_by, check_settings, dataset_config, is_begun
from fsid.dataset.photos import find_photos, read_photo
from fsid.dataset.pictures import check_pictures, find_pictures
from fsid.dataset.png import check_png, save_png, to_uint8
from fsid.dataset.sample import encode, make_frame, make_sample, remake
from fsid.dataset.shards import find_shards, read_member, shard_keys, shard_path, write_shard
from fsid.dataset.single_sample import make_only
from fsid.dataset.unused_settings import check_given
from fsid.dataset.worker import rendering

__all__ = [
    "RENDERED",
    "DatasetConfig",
    "Estimate",
    "GenerateConfig",
    "Sample",
    "Workforce",
    "begun_by",
    "check_count",
    "check_given",
    "check_pictures",
    "check_png",
    "check_settings",
    "contact_sheet",
    "dataset_config",
    "encode",
    "estimate",
    "find_photos",
    "find_pictures",
    "find_shards",
    "generate",
    "generate_config",
    "grid",
    "is_begun",
    "make_frame",
    "make_only",
    "make_sample",
    "pairs_there",
    "pairs_to_make",
    "read_member",
    "read_photo",
    "remake",
    "rendering",
    "sample_key",
    "save_png",
    "shard_keys",
    "shard_path",
    "to_uint8",
    "write_shard",
]
