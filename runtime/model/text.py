"""An emitted module as text: what another process or machine is sent, and checks before it runs it."""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory

from runtime.errors import InputError, ModelError
from runtime.model.generated import GeneratedModel, load_model


@dataclass(frozen=True)
class ModelText:
    """An emitted module as text, for another process: checked there like any file given by path."""

    name: str
    text: str
    digest: str

    @classmethod
    def of(cls, model: GeneratedModel) -> ModelText:
        """The text of the file that the model was loaded from."""
        path = getattr(model, "__file__", None)
        if not path:
            raise InputError("this model was not loaded from a file, which other processes need; use workers=0")
        text = Path(path).read_text(encoding="utf-8")
        return cls(Path(path).name, text, sha256(text.encode("utf-8")).hexdigest())

    def load(self) -> GeneratedModel:
        """The model; ModelError where the text is not the one that was sent, or not an emitted one."""
        if sha256(self.text.encode("utf-8")).hexdigest() != self.digest:
            raise ModelError(f"the text that arrived is not the one that was sent, SHA-256 {self.digest[:12]}", file=self.name)
        with TemporaryDirectory(prefix="symgen-") as folder:
            path = Path(folder) / self.name
            path.write_text(self.text, encoding="utf-8")
            return load_model(path)
