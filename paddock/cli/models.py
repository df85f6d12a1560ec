"""``paddock models``: manages the models of your garage on a site."""

import argparse

from paddock.errors import UserFault

from .asking import ID, Call, confirmed, written
from .files import free
from .settings import split_page
from .showing import one_line, table
from .site import Served, Site

FORMS = {  # of downloads: the path below the model, and the file's ending
    "package": ("package", ".zip"),
    "upload": ("upload", "-upload"),
    "car": ("export/car", ".tar.gz"),
    "openvino": ("export/openvino", "-openvino.tar.gz"),
}


def model_of(asked: Call, given: str) -> tuple[Site, str]:
    """The site and the id of a model, given as its address, its id or its name in the garage.

    Raises UserFault("home_model_unknown"), and what a request raises."""
    where, name = split_page(given, "models")
    site = asked.site(where)
    if ID.fullmatch(name):
        return site, name
    found = [one["public_id"] for one in site.pages("/models/", search=given) if one["name"] == given]
    if len(found) != 1:
        raise UserFault("home_model_unknown", name=given)
    return site, str(found[0])


def list_models(asked: Call, options: argparse.Namespace) -> int:
    """Your models, or the shared models of all racers."""
    path, sort = ("/models/shared/", "") if options.shared else ("/models/", options.sort)
    found = asked.site().pages(path, search=options.search, sort=sort)
    rows = [
        (one["public_id"], one["owner"], one["parameters"], one["uploaded_at"][:10], one["name"])
        for one in found
        if options.search.casefold() in one["name"].casefold()
    ]
    asked.speaker.result(found, table(("model", "owner", "weights", "uploaded", "name"), rows, "No models."))
    return 0


def show(asked: Call, options: argparse.Namespace) -> int:
    site, name = model_of(asked, options.model_id)
    _show(asked, site, site.get(f"/models/{name}/"))
    return 0


def _show(asked: Call, site: Site, model: Served) -> None:
    rows = [
        *((name, model[name]) for name in ("public_id", "owner", "name", "description", "sha256", "parameters")),
        *(("sensors", ", ".join(model["sensors"])), ("uploaded", model["uploaded_at"]), ("shared", model["shared"])),
    ]
    page = f"{site.address}/models/{model['public_id']}/"
    asked.speaker.result(model, "\n".join([*(f"{name:12}{one_line(value)}" for name, value in rows), page]))


def download(asked: Call, options: argparse.Namespace) -> int:
    site, name = model_of(asked, options.model_id)
    path, ending = FORMS[options.form]
    to = free(options.to or f"{name}{ending}")
    return written(asked, to, site.raw("GET", f"/models/{name}/{path}/"))


def rename(asked: Call, options: argparse.Namespace) -> int:
    site, name = model_of(asked, options.model_id)
    _show(asked, site, site.patch(f"/models/{name}/", {"name": options.name}))
    return 0


def delete(asked: Call, options: argparse.Namespace) -> int:
    site, name = model_of(asked, options.model_id)
    confirmed(options, f"Delete the model {options.model_id} from your garage on {site.address}?")
    site.raw("DELETE", f"/models/{name}/")
    asked.speaker.result({"deleted": name}, f"{name} deleted. Its results stay on boards.")
    return 0
