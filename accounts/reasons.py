"""Why something about an account is refused."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Account",
    invalid={
        "class_names": _("Write one name a line, of at most %(limit)s characters each. Nobody was added."),
        "class_student_id": _(
            "Each student ID is for one learner of the class, of at most 80 characters, and follows a name: “%(id)s” "
            "does not fit. Nothing was changed."
        ),
        "picture_broken": _("This picture is incomplete. Save it again and retry."),
        "sso_expired": _("This log-in has expired or was started in another browser. Log in again."),
        "picture_format": _("Send a picture as PNG, JPEG or WebP."),
    },
    unauthorized={
        "sso_failed": _("The log-in by %(provider)s failed. Start again; if it fails again, ask an admin."),
    },
    unavailable={
        "ldap_not_installed": _(
            "Log-in by the directory is set up, but its packages are not installed. Admins run “make ldap”."
        ),
        "ldap_unreachable": _("The directory that knows your password does not answer. Try again later."),
        "sso_unreachable": _("%(provider)s does not answer. Try again later."),
    },
    forbidden={
        "account_not_confirmed": _("Type your alias exactly to confirm."),
        "account_log_in_again": _("Log out and in again, then delete the account within ten minutes."),
        "class_no_teacher": _("A class account cannot have classes."),
        "class_not_yours": _("Only the teacher of the class may do this."),
        "follow_not_this": _(
            "You cannot follow this racer: the account is closed, yours, a house car's or a class account."
        ),
        "group_not_yours": _("Only the leader of the group can do this."),
        "sign_up_domain": _(
            "Your e-mail address is not one for this site. Use an address of: %(domains)s. Otherwise ask an admin."
        ),
        "sso_cancelled": _("You cancelled the log-in at %(provider)s. Log in again to continue."),
        "program_not_yours": _("Only admins with the permission to add programs can do this."),
        "team_by_invitation": _("There is a team of this name: its captain can invite you."),
        "team_captain_only": _("Only the captain of the team may do this."),
        "team_not_asked": _("This invitation is not yours, or was taken back."),
    },
    not_found={
        "sign_up_invitation": _("This invitation is used up or has expired. Ask the sender for a new one."),
        "class_teacher_unknown": _(
            "No racer of this alias can teach the class: it is unknown, the first teacher's, or a learner's."
        ),
        "group_link_unknown": _("This link belongs to no group: it was replaced, or the group is gone."),
        "group_not_a_member": _("Only members can lead the group."),
        "program_owner_unknown": _("The owner must be an active racer."),
        "team_link_unknown": _("This link belongs to no team: it was replaced, or the team is gone."),
        "team_no_such_racer": _("There is no racer of this alias."),
        "team_not_a_member": _("This racer is not in the team."),
    },
    conflict={
        "alias_of_class": _("The alias of a class account stays as it is."),
        "alias_reserved": _("This alias is reserved. Choose another one."),
        "alias_same": _("This is your alias already."),
        "alias_taken": _("This alias is taken, was another racer's until lately, or looks like one that is taken."),
        "account_last_admin": _("You are the last admin. Make another racer an admin first."),
        "account_leads_class": _("You lead the class “%(name)s”. Delete the class on its page first."),
        "account_leads_group": _(
            "You lead the group “%(name)s”. Let a member lead it on its page, or delete it first."
        ),
        "account_not_deletable": _(
            "This account is a house car's, a guest's, of an imported season, or deleted already."
        ),
        "account_of_class": _("Your teacher can delete this account on the page of the class."),
        "class_too_many_teachers": _("A class has at most %(limit)s teachers besides its owner."),
        "class_too_many": _("You may have %(limit)s learners in all your classes. Ask an operator for more."),
        "follow_too_many": _("You already follow %(limit)s racers, the maximum. Unfollow one first."),
        "group_has_races": _("Races are held for this group alone. Hold them for everybody, or delete them first."),
        "group_is_a_class": _("This group is a class. Its teacher changes it on the page of the class."),
        "group_limit": _("You already lead %(limit)s groups, the maximum."),
        "sso_address_taken": _(
            "Another account has the address %(email)s. Log in to that account with its password, verify the address "
            "and connect %(provider)s in the settings. If that is impossible, ask an admin."
        ),
        "program_disabled": _("This program is disabled. Enable it first."),
        "program_name_taken": _("There is an account of this name. Choose another one."),
        "team_full": _("The team already has %(limit)s racers, the maximum."),
        "team_hand_over_first": _("A captain makes somebody else captain before they leave."),
        "team_in_it_already": _("This racer is in the team already."),
        "team_in_one_already": _("You are in a team. Leave it before you join another."),
        "team_name_taken": _("There is a team of this name."),
        "team_too_many_invitations": _("%(limit)s invitations are open. Withdraw some first."),
        "too_many_tokens": _("You already have %(limit)s API tokens. Revoke one that you no longer need."),
    },
    too_large={
        "picture_too_large": _("The picture is larger than %(limit_mb)s MB."),
        "picture_too_many_pixels": _("The picture has more than %(limit)s million pixels."),
    },
    too_many_requests={
        "alias_too_soon": _("You can change the alias once in %(days)s days."),
        "data_too_often": _("You downloaded your data %(limit)s times in a day, the maximum. Try again tomorrow."),
        "class_too_many_codes": _("There were too many wrong codes from here. Wait five minutes."),
    },
)
