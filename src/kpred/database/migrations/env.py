"""What Alembic runs: all migrations in one transaction of the connection that it is given."""

from alembic import context

context.configure(
    connection=context.config.attributes["connection"],
    version_table="kpred_version",
    version_table_schema="kpred",
    transactional_ddl=True,
)
with context.begin_transaction():
    context.run_migrations()
