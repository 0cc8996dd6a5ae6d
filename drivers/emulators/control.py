"""Emulators obey lines of text, such as "stage mute": the device, the fault, and what else there is to say."""

from collections.abc import Mapping

from drivers.emulators.emulator import Emulator


def obey(emulators: Mapping[str, Emulator], line: str) -> str:
    """Let the emulator that `line` names go wrong, and return a sentence for whoever wrote it."""
    words = line.split()
    if not words or words[0] == "help":
        return describe(emulators)
    device, *rest = words
    if device not in emulators:
        return f"there is no '{device}': devices are {', '.join(emulators)}; say 'help' for their faults"
    faults = emulators[device].faults
    if not rest or rest[0] not in faults:
        return f"say '{device}' and one of {', '.join(faults)}; or 'help'"
    fault = faults[rest[0]]
    if len(rest) - 1 != len(fault.words.split()):
        return f"say '{_usage(device, rest[0], fault.words)}'"
    try:
        fault.inject(*rest[1:])
    except ValueError as error:
        return f"{' '.join(words)}: {error}"
    return f"{' '.join(words)}: {fault.sentence}"


def describe(emulators: Mapping[str, Emulator]) -> str:
    """Return what can be said, a line each."""
    lines = {
        _usage(device, name, fault.words): fault.sentence
        for device, emulator in emulators.items()
        for name, fault in emulator.faults.items()
    }
    width = max(map(len, lines), default=0)
    return "\n".join(f"{usage:{width}}  {sentence}" for usage, sentence in lines.items())


def _usage(device: str, fault: str, words: str) -> str:
    return f"{device} {fault} {words}".rstrip()
