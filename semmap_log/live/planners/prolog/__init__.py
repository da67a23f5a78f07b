"""SWI-Prolog: a module that asks a server of questions."""
