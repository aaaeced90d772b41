"""Who is who: explanations of a scan side by side, and what each body is called."""
