"""Programs whose packings can be read, one module each; see `modal.exchange.registry`."""
