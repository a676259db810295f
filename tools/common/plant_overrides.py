"""Keys of the virtual board with their values from one source: a motor or board file, a scenario, the command line."""

from dataclasses import dataclass, field

from .toml_file import Section, flatten

Value = float | tuple[str, float]
"""A number, or ("factor", number) to multiply what the earlier sources gave."""


@dataclass
class Values:
    """Keys with values from one source; `where` says where each was written."""

    values: dict[str, Value] = field(default_factory=dict)
    where: dict[str, str] = field(default_factory=dict)

    @classmethod
    def from_section(cls, section: Section | None) -> "Values":
        """The numbers and factors of a [plant] table."""
        if section is None:
            return cls()
        values = flatten(section, factors=True)
        return cls(values, {key: section.where(key) for key in values})

    def add(self, key: str, value: Value, where: str) -> None:
        """One more key."""
        self.values[key] = value
        self.where[key] = where
