"""Times and amounts of memory in words."""


def spoken_time(seconds: float) -> str:
    """A time as one says it: "40 s", "12 min", "3 h 20 min", "2.1e+03 h (2.4 years)"."""
    minutes = seconds / 60
    if seconds < 90:
        return f"{max(1, round(seconds))} s"
    if minutes < 90:
        return f"{round(minutes)} min"
    hours = minutes / 60
    if hours < 10:
        whole, rest = divmod(5 * round(minutes / 5), 60)
        return f"{whole} h {rest} min" if rest else f"{whole} h"
    years = hours / (24 * 365.25)
    return f"{hours:.2g} h ({years:.2g} years)" if years > 1 else f"{hours:.0f} h"


def spoken_memory(size: float) -> str:
    """An amount of memory in bytes as one says it: "700 MB", "2.3 GB"."""
    return f"{size / 1e9:.2g} GB" if size >= 1e9 else f"{size / 1e6:.0f} MB"
