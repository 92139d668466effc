"""User interfaces: command line, viewer, web application, tuning."""
