"""HTTP: one module per resource, request and answer shapes beside the route."""
