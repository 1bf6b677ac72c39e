"""Short and old spellings: `--web`, and options that were renamed; an error says where others moved."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import typer

# Old options and what they are replaced by, where the command has that and not the old one.
ALIASES: Mapping[str, str] = {"--save": "--rrd", "--run": "--save-run", "--record": "--capture"}
FLAGS: Mapping[str, tuple[str, str]] = {
    "--web": ("--rrd", "web"),
    "--no-recording": ("--rrd", "none"),
    "--headless": ("--rrd", "auto"),
}
SETTINGS: Mapping[str, str] = {
    "--resampler": "resampling.scheme",
    "--sharpness": "sensor.sharpness",
    "--motion": "motion",
}
READING: Mapping[str, str] = {"--plane": "plane"}
# Options of reading that have moved, and their keys in a reading file.
MOVED: Mapping[str, str] = {
    "--format": "format",
    "--camera": "camera",
    "--image-topic": "image_topic",
    "--odometry-topic": "odometry_topic",
    "--truth-topic": "truth_topic",
    "--table": "table",
    "--columns": "columns",
    "--time-unit": "time_unit",
    "--odometry-offset": "odometry_offset_s",
    "--truth-offset": "truth_offset_s",
    "--picture-offset": "picture_offset_s",
    "--odometry-scale": "odometry_scale",
    "--turn-scale": "turn_scale",
    "--turn-gain": "turn_gain",
    "--odometry-forward": "odometry_forward_deg",
    "--odometry-are": "odometry_are",
    "--truth-scale": "truth_scale",
    "--truth-turn-scale": "truth_turn_scale",
    "--camera-yaw": "camera_yaw_deg",
    "--max-dt": "max_dt_s",
    "--min-distance": "min_distance_m",
    "--min-angle": "min_angle_deg",
    "--odometry-from-truth": "odometry_from_truth",
    "--odometry-seed": "odometry_seed",
}


OF_TRIALS = ("-o", "--output", "--seed", "--trials")  # options, each with a value, of what made a table


def modern_command(family: str, args: list[str]) -> list[str]:
    """Replace a command's old name: `calibrate drive` without a recording made a table of trials."""
    if family != "calibrate" or args[:1] != ["drive"] or not set(OF_TRIALS) & set(args):
        return args
    taken = {at + 1 for at, word in enumerate(args) if word in OF_TRIALS}
    names = [word for at, word in enumerate(args[1:], 1) if at not in taken and not word.startswith("-")]
    return args if names or "--help" in args else ["trials", *args[1:]]


def modern(args: list[str], known: Collection[str]) -> list[str]:
    """Replace old spellings by the current ones; `known` are the options of the command.

    An option that has moved to `--reading` is a usage error that names its key there.
    """
    words: list[str] = []
    rest = iter(args)
    for word in rest:
        name, equals, value = word.partition("=")
        if word == "--":
            return [*words, word, *rest]
        if name in known or not name.startswith("--"):
            words.append(word)
        elif ALIASES.get(name) in known:
            words.append(ALIASES[name] + equals + value)
        elif name in FLAGS and FLAGS[name][0] in known:
            words += FLAGS[name]
        elif name in SETTINGS and "--set" in known:
            words += ["--set", f"{SETTINGS[name]}={value if equals else next(rest, '')}"]
        elif name in READING and "--reading" in known:
            words += ["--reading", f"{READING[name]}={value if equals else next(rest, '')}"]
        elif name in MOVED and "--reading" in known:
            key, example = MOVED[name], value or ("true" if name == "--odometry-from-truth" else "...")
            advice = f"give --reading {key}={example}, or the key {key} in a file for --reading FILE.toml"
            raise typer.BadParameter(f"{name} is a key of reading now: {advice}")
        else:
            words.append(word)
    if words.count("--rrd") > 1:
        raise typer.BadParameter("where the Rerun recording goes is given twice; give --rrd once")
    return words
