from .channels import quantisation_step as quantisation_step
from .columns import ColumnSource as ColumnSource
from .columns import parse_columns as parse_columns
from .columns import parse_map_option as parse_map_option
from .reading import read_log as read_log
from .run import Run as Run

__all__: list[str]
