"""All that is known of engines: the protocol, the adapters, and the formats that they share."""
