"""What people see of Spinscope: the command line, the viewer and the reports."""
