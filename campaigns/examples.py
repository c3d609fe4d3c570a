"""An example for every command, as its help shows it. Each works after those before it, which a test tries."""

from __future__ import annotations

#: by command; lines for a shell, in a folder of one's own
EXAMPLES: dict[str, tuple[str, ...]] = {
    "doctor": ("campaign doctor",),
    "list": ("campaign list", "campaign list --localizers"),
    "show": ("campaign show power_sweep",),
    "explain": ("campaign explain scene.beam.half_angle",),
    "schema": ("campaign schema > conespot.schema.json",),
    "completion": ("campaign completion bash > conespot.bash",),
    "init": ("campaign init mine.yaml --poses 5 --resolution 400 --light white,led-b3", "campaign init --microscope"),
    "validate": ("campaign validate mine.yaml",),
    "plan": ("campaign plan mine.yaml --set scene.eye.radius='12 mm'",),
    "preview": ("campaign preview mine.yaml --out mine.png",),
    "run": ("campaign run mine.yaml --set frames=true", "campaign run mine.yaml --shard 1/2"),
    "status": ("campaign status runs/mine",),
    "retry": ("campaign retry runs/mine --failed",),
    "report": ("campaign report runs/mine", "campaign report runs/mine runs/mine-1-of-2"),
    "compare": ("campaign compare runs/mine --lights white,led-b3",),
    "export": ("campaign export runs/mine --frames exported",),
    "score": (
        "sed '1s/.*/frame,x_mm,y_mm,z_mm,reason/; 2,$s/,.*/,,,,no patch/' exported/index.csv > theirs.csv",
        "campaign score runs/mine theirs.csv --name mine",
    ),
    "debug": ("campaign debug runs/mine 1 3",),
    "pack": ("campaign pack runs/mine",),
    "verify": ("campaign verify runs/mine.zip --sample 2",),
    "merge": ("campaign run mine.yaml --shard 2/2", "campaign merge runs/whole runs/mine-1-of-2 runs/mine-2-of-2"),
    "check": ("campaign run theory", "campaign check runs/theory"),
    "localize": ("campaign localize runs/mine/frames/*.png --scene paper-code --set scene.camera.resolution=400",),
    "track": (
        "campaign track runs/mine/frames/*.png --scene paper-code --set scene.camera.resolution=400 --rate '60 Hz'",
    ),
    "calibrate": (
        "campaign calibrate runs/mine/frames --scene paper-code --set scene.camera.resolution=400 --out seen.yaml",
    ),
    "theory": ("campaign theory paper-code --set scene.camera.resolution=1000",),
}


def epilog(command: str) -> str:
    """What stands below a command's options."""
    lines = EXAMPLES.get(command, ())
    return "\n".join([f"example{'s' * (len(lines) > 1)}:", *(f"  {line}" for line in lines)]) if lines else ""
