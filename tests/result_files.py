"""Result folders of few small files."""

from kinertia.io.output_folder import complete_folder


def write(folder, text, *names, kind="fit"):
    with complete_folder(folder, kind) as work:
        for name in names:
            (work / name).parent.mkdir(exist_ok=True)
            (work / name).write_text(text, encoding="utf-8")


def texts_of(folder):
    """Without Kinertia's own list of its files."""
    files = [path for path in folder.rglob("*") if path.is_file() and path.name != ".kinertia.json"]
    return {path.relative_to(folder).as_posix(): path.read_text(encoding="utf-8") for path in files}
