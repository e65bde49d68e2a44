"""The orchestrator around the flows: server, database, worker, queue rules, heartbeat, policy."""
