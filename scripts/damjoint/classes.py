"""Dataclasses of the parts that every run loads. The standard library's compile each method when
the class is made, six for a frozen one: a tenth of a short run in all.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # the type checker holds frozen classes frozen
    from dataclasses import dataclass as dataclass
else:
    import dataclasses

    def dataclass(cls: type | None = None, *, frozen: bool = False, kw_only: bool = False) -> Any:
        """As in the standard library, but instances are compared and printed as any object, and
        frozen ones are not protected at run time.
        """

        def made(cls: type) -> type:
            return dataclasses.dataclass(cls, kw_only=kw_only, eq=False, repr=False)

        return made(cls) if cls else made
