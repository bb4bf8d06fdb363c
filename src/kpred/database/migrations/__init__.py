"""Migrations of the tables on PostgreSQL, run by Alembic (`kpred.database.postgres_schema`)."""
