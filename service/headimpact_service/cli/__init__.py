"""The commands of `headimpact`, one module each; nothing heavy is imported before a command runs."""
