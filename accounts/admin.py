"""Racers, with their addresses, second factors and quotas, and invitations to sign up in the admin site."""

from datetime import timedelta
from typing import Any

from allauth.account import admin as account_admin
from allauth.account.models import EmailAddress, EmailConfirmation
from allauth.mfa import admin as mfa_admin
from allauth.mfa.models import Authenticator
from django.conf import settings
from django.contrib import admin, messages
from django.contrib.auth.admin import UserAdmin
from django.contrib.auth.forms import AdminUserCreationForm, UserChangeForm
from django.db.models import QuerySet
from django.forms import ModelForm
from django.http import HttpRequest, HttpResponseBase
from django.utils import timezone
from django.utils.html import format_html
from django.utils.translation import gettext_lazy as _
from django.utils.translation import ngettext

from core.admin import ComparedChanges
from core.forms import explain
from core.streams.shared_pieces import shared_value
from paddock.errors import UserFault

from .leaving.downloads import download_of_data
from .leaving.services import check_deletion, delete_account, is_deletable
from .models import Classroom, GroupMember, Racer, RacerGroup, RacerQuota, SignUpInvitation, Team, TeamMember
from .pictures.services import remove_picture
from .programs.services import disable_programs_of
from .request_racer import racer_of
from .templatetags.accounts import avatar

A_FORTNIGHT = timedelta(days=14)


# E-mail addresses and second factors are shown with their racer and nowhere else, and secrets nowhere.
for model in (EmailAddress, EmailConfirmation, Authenticator):
    if account_admin.admin.site.is_registered(model) or mfa_admin.admin.site.is_registered(model):
        admin.site.unregister(model)

POWERS = ("is_staff", "is_superuser", "groups", "user_permissions")


class QuotaInline(admin.TabularInline):
    model = RacerQuota
    extra = 0


class NewRacerForm(AdminUserCreationForm):
    class Meta:
        model = Racer
        fields = ("alias", "email")


class RacerForm(UserChangeForm):
    """A racer that an admin changes. The alias is the racer's to change."""

    class Meta:
        model = Racer
        fields = "__all__"

    def clean_email(self) -> str:
        return self.cleaned_data["email"].lower()


class EmailInline(admin.TabularInline):
    model = EmailAddress
    extra = 0


class FactorInline(admin.TabularInline):
    """The racer's second factors. Admins delete lost ones."""

    model = Authenticator
    extra = 0
    fields = readonly_fields = ("type", "created_at", "last_used_at")

    def has_add_permission(self, request: HttpRequest, obj: Racer | None = None) -> bool:
        return False


@admin.register(Racer)
class RacerAdmin(ComparedChanges, UserAdmin):
    """Racers. Deleting an account keeps its results without the name (:mod:`accounts.leaving`)."""

    form = RacerForm
    add_form = NewRacerForm
    list_display = ("alias", "email", "country", "is_active", "is_house", "is_staff", "joined_at", "last_login")
    list_filter = ("is_active", "is_house", "is_staff", "joined_at", "country")
    search_fields = ("alias", "email")
    ordering = ("alias",)
    date_hierarchy = "joined_at"
    filter_horizontal = ("groups", "user_permissions")
    readonly_fields = ("joined_at", "last_login", "is_house", "picture", "past_aliases")
    inlines = (EmailInline, FactorInline, QuotaInline)
    actions = ("deactivate", "activate", "remove_pictures", "download_data")
    fieldsets = (
        (None, {"fields": ("alias", "email", "password", "country", "picture")}),
        (_("Standing"), {"fields": ("past_aliases", "is_active", "is_house", "joined_at", "last_login")}),
        (_("Powers"), {"fields": POWERS}),
    )
    add_fieldsets = (
        (None, {"classes": ("wide",), "fields": ("alias", "email", "usable_password", "password1", "password2")}),
    )

    def get_inlines(self, request: HttpRequest, obj: Racer | None) -> tuple:
        return () if obj is None or obj.is_house else self.inlines

    def get_readonly_fields(self, request: HttpRequest, obj: Racer | None = None) -> tuple[str, ...]:
        """The alias is the racer's to change; powers are given by superusers alone."""
        fixed = tuple(super().get_readonly_fields(request, obj))
        if obj is not None:
            fixed += ("alias",)
        return fixed if request.user.is_superuser else fixed + POWERS

    def formfield_for_manytomany(self, db_field: Any, request: HttpRequest, **options: Any) -> Any:
        """With choices that are read once for all admins: some 500 permissions, each with translated names."""
        field = super().formfield_for_manytomany(db_field, request, **options)
        if field is not None:
            rows: Any = field.queryset
            if db_field.name == "user_permissions":
                rows = rows.select_related("content_type")  # in each name
            field.choices = shared_value(("choices", str(db_field)), lambda: [(one.pk, str(one)) for one in rows])
        return field

    def has_change_permission(self, request: HttpRequest, obj: Racer | None = None) -> bool:
        mightier = obj is not None and obj.is_superuser and not request.user.is_superuser
        return super().has_change_permission(request, obj) and not mightier

    def has_delete_permission(self, request: HttpRequest, obj: Racer | None = None) -> bool:
        mightier = obj is not None and obj.is_superuser and not request.user.is_superuser
        allowed = super().has_delete_permission(request, obj) and not mightier
        return allowed and (obj is None or (is_deletable(obj) and obj.pk != request.user.pk))

    def get_deleted_objects(self, objs: Any, request: HttpRequest) -> tuple[list, dict, set, list]:
        """What the confirmation lists: each account, and what must be done before it can be deleted."""
        protected = []
        for racer in objs:
            try:
                check_deletion(racer=racer, now=timezone.now())
            except UserFault as fault:
                protected.append(f"{racer}: {explain(fault)}")
        allowed = all(self.has_delete_permission(request, racer) for racer in objs)
        shown = [_("%(alias)s: all but results, which stay without the name") % {"alias": one} for one in objs]
        return shown, {self.opts.verbose_name_plural: len(shown)}, set() if allowed else {_("racer")}, protected

    def delete_model(self, request: HttpRequest, obj: Racer) -> None:
        delete_account(racer=obj, by=racer_of(request), now=timezone.now())

    def delete_queryset(self, request: HttpRequest, queryset: QuerySet[Racer]) -> None:
        for racer in queryset:
            self.delete_model(request, racer)

    @admin.action(description=_("Deactivate: no log-in, results stay"), permissions=["change"])
    def deactivate(self, request: HttpRequest, queryset: QuerySet[Racer]) -> None:
        self._set_active(request, queryset.exclude(pk=racer_of(request).pk), False)

    @admin.action(description=_("Activate again"), permissions=["change"])
    def activate(self, request: HttpRequest, queryset: QuerySet[Racer]) -> None:
        self._set_active(request, queryset, True)

    @admin.action(description=_("Remove their pictures: the drawn ones are shown again"), permissions=["change"])
    def remove_pictures(self, request: HttpRequest, queryset: QuerySet[Racer]) -> None:
        done = 0
        for racer in queryset:
            if self.has_change_permission(request, racer) and remove_picture(racer=racer):
                self.log_change(request, racer, "Removed the picture")
                done += 1
        self.message_user(request, ngettext("%d picture was removed.", "%d pictures were removed.", done) % done)

    @admin.action(description=_("Download the data of one racer, at their request"), permissions=["change"])
    def download_data(self, request: HttpRequest, queryset: QuerySet[Racer]) -> HttpResponseBase | None:
        racer = queryset.first()
        if racer is None or queryset.count() > 1 or not self.has_change_permission(request, racer):
            self.message_user(request, _("Choose one racer."), messages.ERROR)
            return None
        self.log_change(request, racer, "Downloaded the personal data")
        return download_of_data(racer=racer, now=timezone.now(), is_limited=False)

    @admin.display(description=_("past aliases"))
    def past_aliases(self, racer: Racer) -> str:
        """With the day until which the racer had each."""

        def read() -> str:
            return ", ".join(f"{one.alias} ({one.changed_at:%Y-%m-%d})" for one in racer.past_aliases.all()) or "–"

        return shared_value(("past aliases", racer.pk), read)

    @admin.display(description=_("picture"))
    def picture(self, racer: Racer) -> str:
        return avatar(racer, 64)

    def _set_active(self, request: HttpRequest, queryset: QuerySet[Racer], active: bool) -> None:
        done = 0
        for racer in queryset.exclude(is_active=active).filter(record_id=None):
            if self.has_change_permission(request, racer):
                racer.is_active = active
                racer.save(update_fields=["is_active"])
                if not active:
                    disable_programs_of(owner=racer)
                self.log_change(request, racer, "Activated" if active else "Deactivated")
                done += 1
        self.message_user(request, ngettext("%d racer was changed.", "%d racers were changed.", done) % done)


@admin.register(SignUpInvitation)
class SignUpInvitationAdmin(ComparedChanges, admin.ModelAdmin):
    """Links to sign up. Used and expired ones stay in the list; deleting one ends it."""

    list_display = ("__str__", "link", "uses", "used", "expires_at", "made_by", "made_at")
    list_filter = ("made_at", "expires_at")
    search_fields = ("note", "made_by__alias")
    readonly_fields = ("link", "used", "made_by", "made_at")
    fields = ("note", "uses", "expires_at", "link", "used", "made_by", "made_at")
    actions = None

    @admin.display(description=_("link"))
    def link(self, invitation: SignUpInvitation) -> str:
        """The address to hand out; as text, so that it is copied and not followed."""
        if not invitation.pk:
            return "–"
        return format_html("<code>{}{}</code>", settings.SITE_URL, invitation.get_absolute_url())

    def save_model(self, request: HttpRequest, obj: SignUpInvitation, form: ModelForm, change: bool) -> None:
        if not change:
            obj.made_by, obj.made_at = racer_of(request), timezone.now()
        super().save_model(request, obj, form, change)

    def get_changeform_initial_data(self, request: HttpRequest) -> dict[str, Any]:
        return {"expires_at": timezone.now() + A_FORTNIGHT} | super().get_changeform_initial_data(request)


class MemberInline(admin.TabularInline):
    model = GroupMember
    extra = 0
    fields = ("racer", "asked_at", "confirmed_at", "confirmed_by")
    autocomplete_fields = ("racer", "confirmed_by")


def _is_class(group: RacerGroup | None) -> bool:
    return group is not None and Classroom.objects.filter(group=group).exists()


@admin.register(RacerGroup)
class RacerGroupAdmin(ComparedChanges, admin.ModelAdmin):
    """Groups of racers; only here are they listed for everybody."""

    list_display = ("name", "leader", "is_listed", "made_at")
    list_filter = ("is_listed", "made_at")
    search_fields = ("name", "leader__alias")
    autocomplete_fields = ("leader",)
    prepopulated_fields = {"slug": ("name",)}
    inlines = (MemberInline,)

    def get_readonly_fields(self, request: HttpRequest, obj: RacerGroup | None = None) -> tuple[str, ...]:
        """A class is never listed, and stays with its teacher."""
        return ("is_listed", "leader") if _is_class(obj) else ()

    def has_delete_permission(self, request: HttpRequest, obj: RacerGroup | None = None) -> bool:
        return super().has_delete_permission(request, obj) and not _is_class(obj)

    def get_changeform_initial_data(self, request: HttpRequest) -> dict[str, Any]:
        return {"made_at": timezone.now()} | super().get_changeform_initial_data(request)


class TeamMemberInline(admin.TabularInline):
    model = TeamMember
    extra = 0
    fields = readonly_fields = ("racer", "joined_at")

    def has_add_permission(self, request: HttpRequest, obj: Team | None = None) -> bool:
        return False


@admin.register(Team)
class TeamAdmin(ComparedChanges, admin.ModelAdmin):
    """Teams. An admin leads every one of them on its page; here they are found."""

    list_display = ("name", "captain", "made_at")
    search_fields = ("name", "captain__alias")
    fields = readonly_fields = ("name", "slug", "captain", "made_at")
    inlines = (TeamMemberInline,)

    def has_add_permission(self, request: HttpRequest) -> bool:
        return False

    def has_delete_permission(self, request: HttpRequest, obj: Team | None = None) -> bool:
        return False
