"""The band and the window of the profile, and the keys of a measured record."""

from collections.abc import Iterator

from mcsettle.railway.filters import D1
from mcsettle.study.checks.parts import Parts
from mcsettle.study.faults import Fault
from mcsettle.study.schema.profile import ProfileTable, RecordTable


def profile_faults(parts: Parts) -> Iterator[Fault]:
    """A band, a window or a record that cannot be, and a limit below the initial SD."""
    profile, limit = parts.profile, parts.limit
    if profile is None:
        return
    yield from _record(profile)
    if parts.grounds is not None and profile.file is not None:
        yield Fault("grounds", "cannot stand beside profile.file")
    if profile.longest_m <= profile.shortest_m:
        message = (
            f"received {profile.longest_m:g}; it must exceed shortest_m = {profile.shortest_m:g}"
        )
        yield Fault("profile.longest_m", message)
    if profile.window_m < 2.0 * profile.longest_m:
        message = (
            f"received {profile.window_m:g}; it must hold longest_m = {profile.longest_m:g} twice"
        )
        yield Fault("profile.window_m", message)
    if limit is not None and profile.sd_mm is not None and limit.sd_limit_mm <= profile.sd_mm:
        message = (
            f"received {limit.sd_limit_mm:g}; it must exceed profile.sd_mm = {profile.sd_mm:g}"
        )
        yield Fault("limit.sd_limit_mm", message)


def _record(profile: ProfileTable) -> Iterator[Fault]:
    """A record's keys need a record; D1 fixes the band; the spectrum's keys need a spectrum."""
    record = profile.record
    if profile.file is None:
        if record is not None:
            yield Fault("profile.record", "has no meaning without profile.file; leave it out")
        return
    for key in ("spectrum", "fra_class"):
        if key in profile.model_fields_set and getattr(profile, key) != (
            ProfileTable.model_fields[key].default
        ):
            yield Fault(f"profile.{key}", "has no meaning with profile.file; leave it out")
    if record is None:
        return
    if record.filter == "en13848_d1" and (profile.shortest_m, profile.longest_m) != D1:
        yield Fault(
            "profile.record.filter",
            f"received 'en13848_d1' with the band {profile.shortest_m:g} to {profile.longest_m:g} m; "
            f"D1 is shortest_m = {D1[0]:g}, longest_m = {D1[1]:g}",
        )
    if record.already_filtered == "en13848_d1":
        if (profile.shortest_m, profile.longest_m) != D1:
            yield Fault(
                "profile.record.already_filtered",
                f"received 'en13848_d1' with the band {profile.shortest_m:g} to "
                f"{profile.longest_m:g} m; waves outside D1 are not in the record: say shortest_m = "
                f"{D1[0]:g}, longest_m = {D1[1]:g}",
            )
        for key in ("filter", "versine_chord_m"):
            if getattr(record, key) != RecordTable.model_fields[key].default:
                said = "has no meaning for a record that is already_filtered; leave it out"
                yield Fault(f"profile.record.{key}", said)
    if record.spacing_m is not None:
        for key in ("chainage_unit", "offset_column"):
            if getattr(record, key) is not None:
                said = "has no meaning beside spacing_m, rows that lie so far apart; leave one out"
                yield Fault(f"profile.record.{key}", said)
    elif record.start_m is not None:
        yield Fault("profile.record.start_m", "is where rows at equal distances begin: spacing_m")
    if record.dates is not None and record.run_column is None:
        yield Fault("profile.record.dates", "says how dates are written; say where: run_column")
    if record.run is not None and record.run_column is None:
        yield Fault("profile.record.run", "names a run; say which column does: run_column")
