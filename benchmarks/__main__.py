"""All measurements, one table each."""

from rich.console import Console

from .flavours import print_flavours
from .step_cost import print_step_cost

console = Console()
print_step_cost(console)
print_flavours(console)
