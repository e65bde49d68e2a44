"""The built-in station with other devices in its places."""

from schemas.station import StationConfig, load_station
from stations.profile_files import load_profile


def station_with(axis: str = "oriental_az", chamber: str = "watlow_f4t") -> StationConfig:
    """The built-in station with these drives and this chamber."""
    config = load_station()
    devices = config.devices
    link = load_profile(chamber).links[0] if load_profile(chamber).commands else "tcp"
    changed = {
        "outer": devices.outer.model_copy(update={"profile": axis}),
        "inner": devices.inner.model_copy(update={"profile": axis}),
        "chamber": devices.chamber.model_copy(update={"profile": chamber, "link": link}),
    }
    return config.model_copy(update={"devices": devices.model_copy(update=changed)})
