"""Writing a session view by view, so that a crash loses at most the view in flight."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.documents import write_json
from calib.durable_files import make_folder_durably, write_durably
from calib.errors import ImageError
from calib.session import Session, View, WorldOrigin

Picture = NDArray[np.uint8] | NDArray[np.uint16]


class SessionWriter:
    """A session folder that grows; `session` is always what is on disk."""

    def __init__(self, folder: Path, session: Session) -> None:
        """Create `folder` and write `session`, whose pictures, if it has any, are already there."""
        make_folder_durably(folder / "frames")
        self.folder = folder
        self.session = session.at(folder)
        write_json(folder / "session.json", self.session)

    def add(self, view: View) -> View:
        """Put one more view on disk, which carries its points or pose itself, and return it."""
        grown = self.session.with_views([*self.session.views, view])
        write_json(self.folder / "session.json", grown)
        self.session = grown
        return view

    def complete(self) -> None:
        """Say on disk that every planned view has been taken."""
        done = self.session.model_copy(update={"complete": True}).at(self.folder)
        write_json(self.folder / "session.json", done)
        self.session = done

    def add_pictures(self, pictures: Sequence[Picture], **fields: Any) -> View:
        """Put one more view on disk, its `pictures` (one or more) first; `fields` are its keys beside them.

        Raises ImageError for a picture that cannot be stored and OSError when the disk does not take it; the
        session is then as it was.
        """
        number = len(self.session.views)
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
