"""Machine code from LLVM's intermediate language, by llvmlite, for the processor at hand."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from typing import Any

import llvmlite.binding as llvm
import numpy as np

from rotorfault.maths.arrays import Array


@lru_cache(maxsize=1)
def lanes() -> int:
    """Doubles in a vector register of this processor."""
    features = llvm.get_host_cpu_features()
    return 8 if features.get("avx512f") else 4 if features.get("avx") else 2


@lru_cache(maxsize=1)
def compiler() -> str:
    """Version of the compiler, and the processor that it compiles for."""
    version = ".".join(map(str, llvm.llvm_version_info))
    return f"LLVM {version} {llvm.get_host_cpu_name()} {llvm.get_host_cpu_features().flatten()}"


@lru_cache(maxsize=2)
def _machine(quickly: bool) -> Any:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=llvm.get_host_cpu_features().flatten(),
        opt=0 if quickly else 3,
        jit=True,
    )


def compile_text(text: str, quickly: bool = False) -> bytes:
    """Object code of a module; of code that is made quickly the numbers are the same to the last bit.

    Parameters
    ----------
    text : str
    quickly : bool, optional
        Whether little time is spent on the choice and order of instructions and on registers.
    """
    return bytes(_machine(quickly).emit_object(_module(text)))


def assembly_of(text: str) -> str:
    """What `compile_text` makes of a module, to be read."""
    return str(_machine(False).emit_assembly(_module(text)))


def _module(text: str) -> Any:
    module = llvm.parse_assembly(f'target triple = "{_machine(False).triple}"\n{text}')
    module.verify()
    return module


class Native:
    """Functions of object code, to be called with arrays and whole numbers; a call lets other threads run.

    Parameters
    ----------
    code : bytes
    functions : sequence of (name, number of arrays, number of whole numbers)
    """

    def __init__(self, code: bytes, functions: Sequence[tuple[str, int, int]]) -> None:
        _machine(False)
        self._jit = llvm.create_lljit_compiler()
        names = [name for name, _, _ in functions]
        builder = llvm.JITLibraryBuilder().add_object_img(code).add_current_process()
        for name in names:
            builder = builder.export_symbol(name)
        self._library = builder.link(self._jit, "rotorfault")
        self._functions = {}
        for name, arrays, numbers in functions:
            kind = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * arrays, *[ctypes.c_int64] * numbers)
            self._functions[name] = kind(self._library[name])

    def bound(self, name: str, *arguments: Array | int) -> Callable[[], None]:
        """A function with its arguments, to be called again and again."""
        pointers = [a.ctypes.data if isinstance(a, np.ndarray) else a for a in arguments]
        call = partial(self._functions[name], *pointers)
        call.needs = (self, *arguments)  # type: ignore[attr-defined]  # they must live as long as their addresses
        return call

    def __call__(self, name: str, *arguments: Array | int) -> None:
        """Call a function; arrays must be contiguous."""
        self._functions[name](*(a.ctypes.data if isinstance(a, np.ndarray) else a for a in arguments))
