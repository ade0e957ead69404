"""The kinds of files that the fuzzer spoils."""

from __future__ import annotations

from random import Random

from tests.hardening.command_target import inputs, run_command, spoil_input
from tests.hardening.fmu_target import fmus, read_fmu
from tests.hardening.log_target import logs, read_some_log, spoil_log
from tests.hardening.model_target import models, read_model
from tests.hardening.mutations import spoil_toml, spoil_zip
from tests.hardening.target import Target
from tests.hardening.toml_targets import (
    calibrations,
    drawings,
    read_calibration,
    read_drawing,
    read_study,
    read_task,
    studies,
    tasks,
)


def _spoil_text(random: Random, content: bytes, others: list[bytes]) -> bytes:
    return spoil_toml(random, content.decode(), [other.decode() for other in others])


TARGETS = {
    "model": Target(models, _spoil_text, read_model),
    "study": Target(studies, _spoil_text, read_study),
    "task": Target(tasks, _spoil_text, read_task),
    "drawing": Target(drawings, _spoil_text, read_drawing),
    "calibration": Target(calibrations, _spoil_text, read_calibration),
    "log": Target(logs, spoil_log, read_some_log),
    "fmu": Target(fmus, lambda random, content, _: spoil_zip(random, content), read_fmu),
    "command": Target(inputs, spoil_input, run_command),
}
