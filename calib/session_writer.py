"""Writing a session view by view, so that a crash loses at most the view in flight."""

from collections.abc import Sequence
from itertools import compress
from operator import not_
from pathlib import Path
from typing import Any, Self

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.documents import write_json
from calib.durable_files import make_folder_durably, write_durably
from calib.errors import ImageError
from calib.session import Session, View, WorldOrigin, load_session

Picture = NDArray[np.uint8] | NDArray[np.uint16]


class SessionWriter:
    """A session folder that grows; `session` is always what is on disk."""

    def __init__(self, folder: Path, session: Session) -> None:
        """Create `folder` and write `session`, whose pictures, if it has any, are already there."""
        make_folder_durably(folder / "frames")
        self.folder = folder
        self.session = session.at(folder)
        write_json(folder / "session.json", self.session)

    @classmethod
    def resume(cls, folder: Path) -> Self:
        """Go on with the session in `folder` after the last sweep that was finished; later views are set aside.

        Raises FormatError where it cannot be read, and ImageError where a picture of a view that is kept is gone.
        """
        session = load_session(folder)
        if session.complete:
            return cls(folder, session)
        done = [view.sweep is not None and view.sweep < session.sweeps_done for view in session.views]
        kept = list(compress(session.views, done))
        cut_off = list(compress(session.views, map(not_, done)))
        for name in (name for view in kept for name in view.frames):
            if not (folder / name).is_file():
                raise ImageError(f"{folder / name}: the picture of a view is gone: start a new run")
        set_aside = [*session.set_aside, *cut_off]
        return cls(folder, session.model_copy(update={"views": kept, "set_aside": set_aside}))

    def add(self, view: View) -> View:
        """Put one more view on disk, which carries its points or pose itself, and return it."""
        self._change(views=[*self.session.views, view])
        return view

    def end_sweep(self) -> None:
        """Say on disk that every view of one more sweep has been taken."""
        self._change(sweeps_done=self.session.sweeps_done + 1)

    def complete(self) -> None:
        """Say on disk that every planned view has been taken."""
        self._change(complete=True)

    def _change(self, **fields: Any) -> None:
        changed = self.session.model_copy(update=fields).at(self.folder)
        write_json(self.folder / "session.json", changed)
        self.session = changed

    def add_pictures(self, pictures: Sequence[Picture], **fields: Any) -> View:
        """Put one more view on disk, its `pictures` (one or more) first; `fields` are its keys beside them.

        Raises ImageError for a picture that cannot be stored and OSError when the disk does not take it; the
        session is then as it was.
        """
        number = len(self.session.views) + len(self.session.set_aside)  # whose pictures stay
        names = [f"frames/{number:04d}{f'-{frame}' if frame else ''}.png" for frame in range(len(pictures))]
        if len(names) > 1:
            fields["images"] = names
        view = View(image=names[0], **fields)
        for name, picture in zip(names, pictures, strict=True):
            done, data = cv2.imencode(".png", picture)
            if not done:
                raise ImageError(f"{self.folder / name}: the picture could not be encoded as PNG")
            write_durably(self.folder / name, data.tobytes())
        return self.add(view)


def keep_origin(session: Session, origin: WorldOrigin | None) -> None:
    """Store in the session on disk which way round its symmetric target was taken, so that it stays that way.

    The first choice stays. Raises OSError where the session cannot be written to.
    """
    if origin is None or session.origin is not None:
        return
    kept = session.model_copy(update={"origin": origin})
    write_json(session.folder / "session.json", kept)
