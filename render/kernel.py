"""The renderer's engine room: finds LLVM, picks the Mitsuba variant, checks versions, loads Mitsuba once.

Nothing else in the project imports mitsuba or chooses a variant; `load()` is the only way in.
"""

from __future__ import annotations

import ctypes
import functools
import importlib.metadata
import os
import re
import sys
import warnings
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

#: LLVM 14 to 16 abort the whole process on the spectral variants ("Cannot select: fmaximum"); 19 works
MINIMUM_LLVM = 19
#: the Mitsuba minor version this package is written for: 3.10 renames the mesh parameters
MITSUBA = "3.9."
#: set to the name of a Mitsuba variant to overrule the choice
VARIANT_OVERRIDE = "CONESPOT_VARIANT"
_LLVM_PATH = "DRJIT_LIBLLVM_PATH"


class KernelError(Exception):
    """Mitsuba cannot be used as it is installed; the message says how to mend it."""


@dataclass(frozen=True)
class Kernel:
    """What was found: the variant in use, why, and the versions."""

    variant: str
    remark: str
    llvm: str
    mitsuba: str
    drjit: str

    @property
    def vectorized(self) -> bool:
        """True for the JIT variants, which trace Python plugins once; False for the scalar fallback."""
        return not self.variant.startswith("scalar")

    @property
    def llvm_version(self) -> int | None:
        """Major version of the LLVM library; None if there is none or it cannot tell."""
        return llvm_version(Path(self.llvm))


def llvm_version(library: Path) -> int | None:
    """Major version of an LLVM shared library, from its file name or else by asking it; None if it cannot tell."""
    for name in (library.name, library.resolve().name):
        match = re.search(r"LLVM(?:-C)?(?:[-.]|\.so\.|-)(\d+)", name)
        if match:
            return int(match[1])
    try:
        major = ctypes.c_uint()
        minor, patch = ctypes.c_uint(), ctypes.c_uint()
        ctypes.CDLL(str(library)).LLVMGetVersion(ctypes.byref(major), ctypes.byref(minor), ctypes.byref(patch))
        return int(major.value)
    except (OSError, AttributeError):
        return None


def find_llvm() -> tuple[Path | None, str]:
    """The LLVM library, and a remark: DRJIT_LIBLLVM_PATH where set, else the wheel's, else the system's newest."""
    given = os.environ.get(_LLVM_PATH)
    candidates = [Path(given)] if given else [*_wheel_libraries(), *_system_libraries()]
    refused = []
    for library in candidates:
        version = llvm_version(library) if library.exists() else None
        if version is not None and version >= MINIMUM_LLVM:
            return library, f"LLVM {version}"
        refused.append(f"{library} ({f'version {version}' if version else 'not a readable LLVM library'})")
    if not refused:
        return None, "no LLVM library found"
    return None, f"LLVM {MINIMUM_LLVM} or newer is needed, found only {', '.join(refused)}"


def _wheel_libraries() -> list[Path]:
    found = []
    try:
        for file in importlib.metadata.files("karellen-llvm-core") or ():
            if re.search(r"libLLVM\.so\.\d", file.name):
                found.append(Path(str(file.locate())).resolve())
    except importlib.metadata.PackageNotFoundError:
        pass
    found += sorted(Path(sys.prefix, "lib").glob("libLLVM.so.[0-9]*"), reverse=True)
    return [library for library in dict.fromkeys(found) if library.exists()]


def _system_libraries() -> list[Path]:
    folders = ["/usr/lib", "/usr/lib64", "/usr/local/lib", "/opt/homebrew/opt/llvm/lib", "/usr/local/opt/llvm/lib"]
    folders += [str(p) for root in ("/usr/lib",) for p in Path(root).glob("llvm-*/lib")]
    folders += [str(p) for p in Path("/usr/lib").glob("*-linux-gnu")]
    libraries = [p for folder in folders for p in Path(folder).glob("libLLVM*") if p.suffix != ".a"]
    return sorted(libraries, key=lambda p: llvm_version(p) or 0, reverse=True)


@functools.cache
def load() -> tuple[ModuleType, ModuleType, Kernel]:
    """Mitsuba, Dr.Jit and what was chosen: CUDA, else LLVM, else scalar (about 9 times slower), always spectral.

    The fall-back to scalar warns in one line. Raises KernelError for a wrong Mitsuba version or an unknown variant.
    """
    llvm, remark = find_llvm()
    # always set, also to nothing: Dr.Jit's own search would load an LLVM that aborts the process
    os.environ[_LLVM_PATH] = str(llvm) if llvm else os.devnull
    import drjit
    import mitsuba

    dr: ModuleType = drjit
    mi: ModuleType = mitsuba

    if not mi.__version__.startswith(MITSUBA):
        raise KernelError(
            f"mitsuba {mi.__version__} is installed but {MITSUBA}* is needed: pip install 'mitsuba=={MITSUBA}*'"
        )
    wanted = os.environ.get(VARIANT_OVERRIDE)
    if wanted and wanted not in mi.variants():
        raise KernelError(f"{VARIANT_OVERRIDE}={wanted}: no such variant; this Mitsuba has {', '.join(mi.variants())}")
    if wanted:
        variant, remark = wanted, f"{VARIANT_OVERRIDE} is set; {remark}"
    elif "cuda_ad_spectral" in mi.variants() and _cuda_driver() and dr.has_backend(dr.JitBackend.CUDA):
        variant = "cuda_ad_spectral"
    elif llvm is not None and dr.has_backend(dr.JitBackend.LLVM):
        variant = "llvm_ad_spectral"
    else:
        variant = "scalar_spectral"
        warnings.warn(f"rendering with the slow scalar variant: {remark}", RuntimeWarning, stacklevel=2)
    mi.set_variant(variant)
    mi.set_log_level(mi.LogLevel.Error)
    return mi, dr, Kernel(variant, remark, str(llvm or "none"), mi.__version__, dr.__version__)


def _cuda_driver() -> bool:
    """Whether a CUDA driver is installed; asked before Dr.Jit is, which complains on stderr where LLVM is missing."""
    try:
        ctypes.CDLL("nvcuda.dll" if sys.platform == "win32" else "libcuda.so.1")
    except OSError:
        return False
    return True


def use_threads(count: int) -> None:
    """Render with `count` threads in this process. One thread also makes every image bit-reproducible."""
    _, dr, _ = load()
    dr.set_thread_count(count)
