"""The server of fits (`kpred serve`) and the client of it: start-up is paid once. Needs the extra `serve`."""
