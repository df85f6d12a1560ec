"""Django's detector of changes, without changes of labels, help texts and choices, which no database stores."""

from typing import Any

from django.db import models
from django.db.migrations.autodetector import MigrationAutodetector
from django.db.migrations.operations import AlterModelOptions

# Arguments of a field that no database stores, see Field.non_db_attrs
FIELD_TEXTS = ("choices", "error_messages", "help_text", "validators", "verbose_name")
MODEL_TEXTS = {"verbose_name", "verbose_name_plural"}


class TextBlindAutodetector(MigrationAutodetector):
    """Django's detector, blind to texts of fields and models."""

    generated_operations: dict[str, list[Any]]

    def deep_deconstruct(self, obj: Any) -> Any:
        deconstructed = super().deep_deconstruct(obj)
        if isinstance(obj, models.Field):
            for name in FIELD_TEXTS:
                deconstructed[2].pop(name, None)
        return deconstructed

    def generate_altered_options(self) -> None:
        super().generate_altered_options()
        for app, found in self.generated_operations.items():
            self.generated_operations[app] = [operation for operation in found if not self._only_words(app, operation)]

    def _only_words(self, app: str, operation: Any) -> bool:
        if not isinstance(operation, AlterModelOptions):
            return False
        old_name = self.renamed_models.get((app, operation.name_lower), operation.name_lower)
        old = self.from_state.models[app, old_name].options
        names = set(AlterModelOptions.ALTER_OPTION_KEYS) - MODEL_TEXTS
        return all(old.get(name) == operation.options.get(name) for name in names)
