"""The pages of vehicles."""

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils.translation import gettext as _
from django.views.decorators.http import require_http_methods, require_safe

from accounts.request_racer import racer_of
from core.forms import add_fault, say_saved
from evaluation.models import TrainedModel
from evaluation.selectors import visible_models
from paddock.errors import UserFault
from training.models import Vehicle
from training.vehicles.forms import VehicleForm
from training.vehicles.services import VEHICLES_PER_RACER, delete_vehicle, save_vehicle, vehicle_like, vehicles_of


@login_required
@require_safe
def vehicles(request: HttpRequest) -> HttpResponse:
    context = {"vehicles": vehicles_of(request.user), "limit": VEHICLES_PER_RACER}
    return render(request, "training/vehicles/list.html", context)


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def vehicle_new(request: HttpRequest) -> HttpResponse:
    """Add a vehicle; ``?clone=`` proposes one that goes with a model's weights, and leads back to the wizard."""
    return _form(request, None, visible_models(request.user).filter(public_id=request.GET.get("clone", "")).first())


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def vehicle_edit(request: HttpRequest, public_id: str) -> HttpResponse:
    return _form(request, get_object_or_404(vehicles_of(request.user), public_id=public_id))


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def vehicle_delete(request: HttpRequest, public_id: str) -> HttpResponse:
    vehicle = get_object_or_404(vehicles_of(request.user), public_id=public_id)
    if request.method == "POST":
        delete_vehicle(vehicle=vehicle)
        messages.success(request, _("Vehicle deleted. Models trained with it stay."))
        return redirect("vehicles")
    return render(request, "training/vehicles/delete.html", {"vehicle": vehicle})


def _form(request: HttpRequest, vehicle: Vehicle | None, clone: TrainedModel | None = None) -> HttpResponse:
    form = VehicleForm(request.POST or None, vehicle=vehicle if clone is None else vehicle_like(clone))
    if request.method == "POST" and form.is_valid():
        try:
            save_vehicle(owner=racer_of(request), vehicle=vehicle, **form.values())
        except UserFault as fault:
            add_fault(form, fault, "name" if fault.code == "vehicle_name_taken" else None)
        else:
            say_saved(request, form)
            if clone is not None:
                return redirect(f"{reverse('training_new')}?clone={clone.public_id}")
            return redirect("vehicles")
    status = 422 if form.errors else 200
    return render(request, "training/vehicles/form.html", {"form": form, "vehicle": vehicle}, status=status)
